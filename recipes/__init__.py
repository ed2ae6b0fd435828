"""How the library that ships is made, so that anybody can make it again."""
