"""The command line of Pandion: the only package that knows both processes."""
