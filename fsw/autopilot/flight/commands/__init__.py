"""What commands and arming are decided on: one file a question."""
