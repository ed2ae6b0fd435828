"""Models of motion: templates, keyframe queries, the class library and their learning."""
