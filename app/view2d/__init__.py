"""Height maps as images: colours, relief, colour bar, scales, and points read from them."""
