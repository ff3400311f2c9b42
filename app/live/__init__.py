"""The live image with its depth, for every page: session, frame processor, viewer, overlays."""
