"""A made-up paper: one lamp seen through two lenses."""

ITEMS = {
    "lamp2025/table-1": "",
    "lamp2025/fig-1": "lenses",
    "lamp2025/table-2": "lenses",
}
STUDIES = {"lamp2025/ratio": "lenses"}
