/// Linked first: all code behind it starts EFFUSE_CODE_SHIFT bytes further on.
#define EFFUSE_TEXT_(x) #x
#define EFFUSE_TEXT(x) EFFUSE_TEXT_(x)
asm(".text\n.skip " EFFUSE_TEXT(EFFUSE_CODE_SHIFT));
