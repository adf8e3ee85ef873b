"""One flight in one process, without the link: what to fly, both plants, and what it leaves."""
