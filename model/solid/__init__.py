"""A straw as a body that can be printed or moulded: its outline, triangles (STL) and surfaces of revolution (STEP)."""
