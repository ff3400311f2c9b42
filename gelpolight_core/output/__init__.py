"""What leaves the program: height map files, recordings and reports."""
