"""Camera drivers, and one camera shared by its users."""
