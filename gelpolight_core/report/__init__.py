"""Reports of calibrations, evaluations and measurements: data, drawings, and one template."""
