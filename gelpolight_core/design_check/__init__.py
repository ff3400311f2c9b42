"""Check of a sensor design before it is built."""
