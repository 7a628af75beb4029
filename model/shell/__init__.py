"""The walls' elasticity: finite elements of a frustum or a cell, director shells of revolution bent in one plane."""
