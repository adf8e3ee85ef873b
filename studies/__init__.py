"""Studies: many flights in process, without sockets, and what is made of them."""
