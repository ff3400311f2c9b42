"""The camera's response: from the numbers it delivers to linear light."""
