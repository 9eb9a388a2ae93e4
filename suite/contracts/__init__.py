"""What each kind of plug-in must hold, one function a check."""
