"""Parameters at run time: the store that is changed in flight, and files of them."""
