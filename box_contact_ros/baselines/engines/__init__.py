"""What answers for a pair of boxes: this package's models and the engines that users would take."""
