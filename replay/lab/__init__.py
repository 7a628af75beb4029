"""The local web application: catalogue, operator's panel, and what every page of this project is served behind."""
