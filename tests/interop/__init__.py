"""Other people's clients, over real sockets. A package, so that its tests can share a vehicle."""
