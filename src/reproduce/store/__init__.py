"""What lies in files beside the print: a reader's points, the star catalogue, slow studies."""
