"""The judge: every constraint of a finished plan, checked by laws of its own."""
