"""The local web application: catalogue, operator's panel, and the guard of every page that this project serves."""
