"""The near-light model: one solver for every scale and region."""
