"""Result folders: written, read, drawn."""
