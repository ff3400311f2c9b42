"""From slopes to depth: the Poisson equation, plain and weighted."""
