"""An independent painter of videos: shares no code with ``tracking``, so that neither hides the other's errors."""
