"""Light intensity on the membrane from the whiteboard (Eq. 5)."""
