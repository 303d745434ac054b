"""What travels between robot and service, and how it is encoded."""
