"""The solver of closed sensors: from change of colour to slopes to depth."""
