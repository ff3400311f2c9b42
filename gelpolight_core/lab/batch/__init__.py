"""Resumable runs over recordings and image folders, in many processes or on a cluster."""
