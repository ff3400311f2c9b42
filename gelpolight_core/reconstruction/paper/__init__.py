"""The model of the paper: light of the flat membrane, one fused pass over the image."""
