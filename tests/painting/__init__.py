"""An independent painter of videos: shares no code with ``tracking``, so that neither can mask the other's errors."""
