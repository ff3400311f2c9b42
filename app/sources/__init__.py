"""Where pictures come from: the virtual sensor, folders of pictures, and the threads between."""
