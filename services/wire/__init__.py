"""Messages between robot and service, and their encoding, order and queues."""
