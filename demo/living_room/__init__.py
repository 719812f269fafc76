"""The demo living room: materials, furniture, lights and cameras, built in Blender."""
