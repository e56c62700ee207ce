"""Scenes without ROS: boxes and pairs, scene files, pairing by stamps, pose sets, forces."""
