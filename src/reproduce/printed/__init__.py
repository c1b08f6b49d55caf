"""The numbers as the papers print them, and the door that hands out inputs."""
