"""Is it right: hard poses, an independent judge, fuzzing."""
