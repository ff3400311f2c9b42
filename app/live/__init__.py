"""The live image and its depth, for every page: session, frame processor, viewer, overlays."""
