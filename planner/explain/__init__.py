"""Why a plan is not faster, bound by bound."""
