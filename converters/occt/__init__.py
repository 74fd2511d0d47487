"""The CAD kernel: the only place in the project that imports OCP."""
