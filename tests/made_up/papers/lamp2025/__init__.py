"""A made-up paper: one lamp seen through two lenses."""
