"""What a lab does with a calibrated sensor: evaluation, validation, records, batches."""
