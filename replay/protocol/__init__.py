"""What a protocol will do: as a picture, as a prediction, and beside a recording of it."""
