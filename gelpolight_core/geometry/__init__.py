"""Circles, spheres and planes through points, robust weights, and the membrane beside a ball."""
