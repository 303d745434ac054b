"""From fits to a verdict, and to the model that is safe to plan with."""
