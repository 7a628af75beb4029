"""What the walls do: finite elements of a frustum and a cell, as director shells of revolution bent in one plane."""
