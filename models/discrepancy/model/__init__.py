"""Hypotheses, and the speeds that they predict."""
