"""The model of the paper: lights frozen at the flat membrane, one fused pass over the image."""
