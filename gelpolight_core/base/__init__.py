"""What all folders use: errors, findings, quantities, files, least squares, compiled loops."""
