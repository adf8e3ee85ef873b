"""The exact coupled model of a multirotor with an arm; shares no physics with the controller."""
