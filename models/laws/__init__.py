"""One law a file: equation, source, validity, and the misprints of the papers."""
