"""How the hot path is compiled, the arrays it works in, and the limits it reads."""
