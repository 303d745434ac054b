"""What may be true, the speeds it predicts, and the noise around them."""
