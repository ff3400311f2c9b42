"""The camera response: from pixel values to linear light."""
