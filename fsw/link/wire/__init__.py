"""What goes over the wire: message ids, encoders and decoders; pure."""
