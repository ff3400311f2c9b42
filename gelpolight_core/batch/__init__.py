"""Recordings and folders of pictures of any size, by many processes or a cluster; can be left."""
