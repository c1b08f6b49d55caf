"""The printed numbers, and access to the declared inputs."""
