"""How fast each station may be passed, and which bound says so."""
