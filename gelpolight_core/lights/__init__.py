"""LED positions from their mirror spots, and light directions on the membrane."""
