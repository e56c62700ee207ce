"""Topics of the contact node: those of a scene, /tf, and their QoS events."""
