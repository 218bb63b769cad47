"""What people start: commands, importers, exports, the emulator, the dashboard."""
