"""What all rooms use: errors, findings, quantities, files of any content, least squares."""
