"""From contacts to forces: the patch law, and what every such law shares."""
